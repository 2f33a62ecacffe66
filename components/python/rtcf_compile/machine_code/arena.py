"""What compiled code calls instead of an allocator: an arena that is emptied before each hook.

As LLVM's assembly, pointers with types (backend.py), linked into each object, so that it is
inlined. A block begins with what numba calls a MemInfo: references, destructor, its argument, data,
size, allocator; the argument's place holds where the arena began before the block. What is released
last in first out is used again, so that a loop may make temporaries; one that does not fit is a
MemoryError, never more memory.
"""

HEADER = 64
ALIGNMENT = 32


def assembly(size: int) -> str:
    """Return the arena's functions, for an arena of that many bytes."""
    return f"""
@rtcf_arena = internal global [{size} x i8] zeroinitializer, align 64
@rtcf_arena_used = internal global i64 0

define noalias i8* @NRT_Allocate(i64 %bytes) {{
  %used = load i64, i64* @rtcf_arena_used
  %more = add i64 %bytes, {ALIGNMENT - 1}
  %rounded = and i64 %more, -{ALIGNMENT}
  %end = add i64 %used, %rounded
  %huge = icmp ugt i64 %bytes, {size}
  %over = icmp ugt i64 %end, {size}
  %full = or i1 %huge, %over
  br i1 %full, label %none, label %some
none:
  ret i8* null
some:
  store i64 %end, i64* @rtcf_arena_used
  %block = getelementptr [{size} x i8], [{size} x i8]* @rtcf_arena, i64 0, i64 %used
  ret i8* %block
}}

define void @NRT_Free(i8* %block) {{
  ret void
}}

define noalias i8* @NRT_MemInfo_alloc_safe_aligned(i64 %bytes, i32 %alignment) {{
  %huge = icmp ugt i64 %bytes, {size}
  br i1 %huge, label %none, label %fits
fits:
  %before = load i64, i64* @rtcf_arena_used
  %whole = add i64 %bytes, {HEADER}
  %block = call i8* @NRT_Allocate(i64 %whole)
  %full = icmp eq i8* %block, null
  br i1 %full, label %none, label %some
none:
  ret i8* null
some:
  %words = bitcast i8* %block to i64*
  store i64 1, i64* %words
  %destructor = getelementptr i64, i64* %words, i64 1
  store i64 0, i64* %destructor
  %began = getelementptr i64, i64* %words, i64 2
  store i64 %before, i64* %began
  %data = getelementptr i8, i8* %block, i64 {HEADER}
  %place = getelementptr i64, i64* %words, i64 3
  %pointer = bitcast i64* %place to i8**
  store i8* %data, i8** %pointer
  %length = getelementptr i64, i64* %words, i64 4
  store i64 %bytes, i64* %length
  %allocator = getelementptr i64, i64* %words, i64 5
  store i64 0, i64* %allocator
  ret i8* %block
}}

define i8* @NRT_MemInfo_alloc_aligned(i64 %bytes, i32 %alignment) {{
  %block = call i8* @NRT_MemInfo_alloc_safe_aligned(i64 %bytes, i32 %alignment)
  ret i8* %block
}}

define void @NRT_incref(i8* %block) {{
  %none = icmp eq i8* %block, null
  br i1 %none, label %done, label %count
count:
  %references = bitcast i8* %block to i64*
  %now = load i64, i64* %references
  %more = add i64 %now, 1
  store i64 %more, i64* %references
  br label %done
done:
  ret void
}}

define void @NRT_decref(i8* %block) {{
  %none = icmp eq i8* %block, null
  br i1 %none, label %done, label %count
count:
  %references = bitcast i8* %block to i64*
  %now = load i64, i64* %references
  %less = sub i64 %now, 1
  store i64 %less, i64* %references
  %last = icmp eq i64 %less, 0
  br i1 %last, label %released, label %done
released:
  call void @NRT_MemInfo_call_dtor(i8* %block)
  br label %done
done:
  ret void
}}

; Gives the block back if nothing lies behind it.
define void @NRT_MemInfo_call_dtor(i8* %block) {{
  %words = bitcast i8* %block to i64*
  %length = getelementptr i64, i64* %words, i64 4
  %bytes = load i64, i64* %length
  %whole = add i64 %bytes, {HEADER + ALIGNMENT - 1}
  %rounded = and i64 %whole, -{ALIGNMENT}
  %began = getelementptr i64, i64* %words, i64 2
  %before = load i64, i64* %began
  %end = add i64 %before, %rounded
  %used = load i64, i64* @rtcf_arena_used
  %top = icmp eq i64 %end, %used
  br i1 %top, label %back, label %done
back:
  store i64 %before, i64* @rtcf_arena_used
  br label %done
done:
  ret void
}}
"""


def entry(symbol: str, inner: str, record: str, exception: str) -> str:
    """Return a hook's function as C calls it: null, or what it raised.

    `const void* symbol(void* record)`; `record` and `exception` are what the inner function takes:
    the component's members, and the place for what it raises.
    """
    return f"""
declare i32 @{inner}(i8**, {exception}, {record})

define i8* @{symbol}({record} %self) {{
  store i64 0, i64* @rtcf_arena_used
  %result = alloca i8*
  %raised = alloca i8*
  store i8* null, i8** %result
  store i8* null, i8** %raised
  %place = bitcast i8** %raised to {exception}
  %status = call i32 @{inner}(i8** %result, {exception} %place, {record} %self)
  %fine = icmp eq i32 %status, 0
  %none = icmp eq i32 %status, -2
  %good = or i1 %fine, %none
  br i1 %good, label %ended, label %fault
ended:
  ret i8* null
fault:
  %what = load i8*, i8** %raised
  ret i8* %what
}}
"""
