"""Replaces numba's allocator, as LLVM assembly (typed pointers, see backend.py), which is linked
into each object so that it is inlined.

A block begins with a header of eight words, which numba calls a MemInfo: references, destructor,
block size (heap: previous block), data, size, and a link in the place of the allocator.

In the real-time thread, blocks lie in an arena, which is empty at the start of each hook. A
released block at the top returns to the arena; others go to a free list for their size class, with
four classes per power of two. So a loop of any length reuses the memory of its first iterations. An
allocation that does not fit raises MemoryError; the arena never grows. Each allocation takes a
constant number of instructions. Most arrays need no block: see stack.py.

Hooks outside the real-time thread use the heap. Blocks left after a fault are freed at the end of
the hook.
"""

HEADER = 64
_SMALLEST = 128  # bytes, including the header
_LISTS = 40  # free lists, for blocks of 128 bytes to 128 KiB


# Declarations for the entries of hooks, until the allocator is linked.
DECLARATIONS = """
declare void @rtcf_begin_hook()
declare void @rtcf_end_hook()
@rtcf_raised_values = external global [2 x i64]
"""

_COUNTS = """
@rtcf_raised_values = global [2 x i64] zeroinitializer

define i8* @NRT_MemInfo_alloc_aligned(i64 %bytes, i32 %alignment) {
  %block = call i8* @NRT_MemInfo_alloc_safe_aligned(i64 %bytes, i32 %alignment)
  ret i8* %block
}

define internal void @rtcf_begin(i8* %block, i64 %bytes) {
  %words = bitcast i8* %block to i64*
  store i64 1, i64* %words
  %destructor = getelementptr i64, i64* %words, i64 1
  store i64 0, i64* %destructor
  %data = getelementptr i8, i8* %block, i64 64
  %place = getelementptr i64, i64* %words, i64 3
  %pointer = bitcast i64* %place to i8**
  store i8* %data, i8** %pointer
  %length = getelementptr i64, i64* %words, i64 4
  store i64 %bytes, i64* %length
  ret void
}

define void @NRT_incref(i8* %block) {
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
}

define void @NRT_decref(i8* %block) {
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
}
"""


def arena(size: int) -> str:
    """Return the allocator with an arena of `size` bytes."""
    return f"""
@rtcf_arena = internal global [{size} x i8] zeroinitializer, align 64
@rtcf_arena_used = internal global i64 0
@rtcf_arena_free = internal global [{_LISTS} x i64] zeroinitializer, align 64
declare i64 @llvm.ctlz.i64(i64, i1)

; Free lists store offsets plus 1; 0 is the end of a list.
define internal i64 @rtcf_arena_class(i64 %rounded) {{
  %zeros = call i64 @llvm.ctlz.i64(i64 %rounded, i1 true)
  %power = sub i64 63, %zeros
  %shift = sub i64 %power, 2
  %shifted = lshr i64 %rounded, %shift
  %part = and i64 %shifted, 3
  %wide = shl i64 %power, 2
  %both = add i64 %wide, %part
  %class = sub i64 %both, 28
  ret i64 %class
}}

define i8* @NRT_MemInfo_alloc_safe_aligned(i64 %bytes, i32 %alignment) {{
  %huge = icmp ugt i64 %bytes, {size - HEADER}
  br i1 %huge, label %none, label %fits
fits:
  %with_header = add i64 %bytes, {HEADER}
  %small = icmp ult i64 %with_header, {_SMALLEST}
  %whole = select i1 %small, i64 {_SMALLEST}, i64 %with_header
  %zeros = call i64 @llvm.ctlz.i64(i64 %whole, i1 true)
  %shift = sub i64 61, %zeros
  %step = shl i64 1, %shift
  %more = sub i64 %step, 1
  %above = add i64 %whole, %more
  %mask = xor i64 %more, -1
  %rounded = and i64 %above, %mask
  %class = call i64 @rtcf_arena_class(i64 %rounded)
  %list = getelementptr [{_LISTS} x i64], [{_LISTS} x i64]* @rtcf_arena_free, i64 0, i64 %class
  %first = load i64, i64* %list
  %empty = icmp eq i64 %first, 0
  br i1 %empty, label %new, label %again
again:
  %offset = sub i64 %first, 1
  %freed = getelementptr [{size} x i8], [{size} x i8]* @rtcf_arena, i64 0, i64 %offset
  %freed_words = bitcast i8* %freed to i64*
  %link = getelementptr i64, i64* %freed_words, i64 5
  %next = load i64, i64* %link
  store i64 %next, i64* %list
  br label %some
new:
  %used = load i64, i64* @rtcf_arena_used
  %end = add i64 %used, %rounded
  %over = icmp ugt i64 %end, {size}
  br i1 %over, label %none, label %top
top:
  store i64 %end, i64* @rtcf_arena_used
  %fresh = getelementptr [{size} x i8], [{size} x i8]* @rtcf_arena, i64 0, i64 %used
  br label %some
some:
  %block = phi i8* [ %freed, %again ], [ %fresh, %top ]
  call void @rtcf_begin(i8* %block, i64 %bytes)
  %words = bitcast i8* %block to i64*
  %size = getelementptr i64, i64* %words, i64 2
  store i64 %rounded, i64* %size
  %allocator = getelementptr i64, i64* %words, i64 5
  store i64 0, i64* %allocator
  ret i8* %block
none:
  ret i8* null
}}

define void @NRT_MemInfo_call_dtor(i8* %block) {{
  %words = bitcast i8* %block to i64*
  %size = getelementptr i64, i64* %words, i64 2
  %rounded = load i64, i64* %size
  %begin = ptrtoint [{size} x i8]* @rtcf_arena to i64
  %address = ptrtoint i8* %block to i64
  %offset = sub i64 %address, %begin
  %end = add i64 %offset, %rounded
  %used = load i64, i64* @rtcf_arena_used
  %top = icmp eq i64 %end, %used
  br i1 %top, label %back, label %list
back:
  store i64 %offset, i64* @rtcf_arena_used
  ret void
list:
  %class = call i64 @rtcf_arena_class(i64 %rounded)
  %place = getelementptr [{_LISTS} x i64], [{_LISTS} x i64]* @rtcf_arena_free, i64 0, i64 %class
  %first = load i64, i64* %place
  %link = getelementptr i64, i64* %words, i64 5
  store i64 %first, i64* %link
  %mine = add i64 %offset, 1
  store i64 %mine, i64* %place
  ret void
}}

define void @rtcf_begin_hook() {{
  %used = load i64, i64* @rtcf_arena_used
  %clean = icmp eq i64 %used, 0
  br i1 %clean, label %done, label %empty
empty:
  store i64 0, i64* @rtcf_arena_used
  store [{_LISTS} x i64] zeroinitializer, [{_LISTS} x i64]* @rtcf_arena_free
  br label %done
done:
  ret void
}}

define void @rtcf_end_hook() {{
  ret void
}}
{_COUNTS}"""


def heap() -> str:
    """Return the allocator for hooks outside the real-time thread, which uses the heap."""
    return f"""
@rtcf_blocks = internal global i8* null
declare i8* @aligned_alloc(i64, i64)
declare void @free(i8*)

define i8* @NRT_MemInfo_alloc_safe_aligned(i64 %bytes, i32 %alignment) {{
  %huge = icmp ugt i64 %bytes, {2**62}
  br i1 %huge, label %none, label %fits
fits:
  %above = add i64 %bytes, {HEADER + 63}
  %whole = and i64 %above, -64
  %block = call i8* @aligned_alloc(i64 64, i64 %whole)
  %full = icmp eq i8* %block, null
  br i1 %full, label %none, label %some
some:
  call void @rtcf_begin(i8* %block, i64 %bytes)
  %pointers = bitcast i8* %block to i8**
  %previous = getelementptr i8*, i8** %pointers, i64 2
  store i8* null, i8** %previous
  %next = getelementptr i8*, i8** %pointers, i64 5
  %first = load i8*, i8** @rtcf_blocks
  store i8* %first, i8** %next
  store i8* %block, i8** @rtcf_blocks
  %alone = icmp eq i8* %first, null
  br i1 %alone, label %done, label %behind
behind:
  %others = bitcast i8* %first to i8**
  %back = getelementptr i8*, i8** %others, i64 2
  store i8* %block, i8** %back
  br label %done
done:
  ret i8* %block
none:
  ret i8* null
}}

define void @NRT_MemInfo_call_dtor(i8* %block) {{
  %pointers = bitcast i8* %block to i8**
  %previous_place = getelementptr i8*, i8** %pointers, i64 2
  %previous = load i8*, i8** %previous_place
  %next_place = getelementptr i8*, i8** %pointers, i64 5
  %next = load i8*, i8** %next_place
  %is_first = icmp eq i8* %previous, null
  br i1 %is_first, label %first, label %later
first:
  store i8* %next, i8** @rtcf_blocks
  br label %forward
later:
  %before = bitcast i8* %previous to i8**
  %before_next = getelementptr i8*, i8** %before, i64 5
  store i8* %next, i8** %before_next
  br label %forward
forward:
  %is_last = icmp eq i8* %next, null
  br i1 %is_last, label %done, label %link
link:
  %after = bitcast i8* %next to i8**
  %after_previous = getelementptr i8*, i8** %after, i64 2
  store i8* %previous, i8** %after_previous
  br label %done
done:
  call void @free(i8* %block)
  ret void
}}

define void @rtcf_begin_hook() {{
  ret void
}}

define void @rtcf_end_hook() {{
  br label %look
look:
  %block = load i8*, i8** @rtcf_blocks
  %none = icmp eq i8* %block, null
  br i1 %none, label %done, label %left
left:
  call void @NRT_MemInfo_call_dtor(i8* %block)
  br label %look
done:
  ret void
}}
{_COUNTS}"""
