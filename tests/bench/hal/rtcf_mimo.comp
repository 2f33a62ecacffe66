component rtcf_mimo "Sums its inputs that have new data: rtcf's Mimo in LinuxCNC HAL";
description """
HAL does not know whether a value is new, so each value has a count.
""";
pin in float in1;
pin in u32 in1_count;
pin in float in2;
pin in u32 in2_count;
pin in float in3;
pin in u32 in3_count;
pin in float in4;
pin in u32 in4_count;
pin out float out1;
pin out u32 out1_count;
pin out float out2;
pin out u32 out2_count;
variable unsigned seen1;
variable unsigned seen2;
variable unsigned seen3;
variable unsigned seen4;
function _;
license "MIT";
;;
FUNCTION(_) {
    double sum = 1.0;
    if (in1_count != seen1) {
        seen1 = in1_count;
        sum = in1;
    }
    if (in2_count != seen2) {
        seen2 = in2_count;
        sum += in2;
    }
    if (in3_count != seen3) {
        seen3 = in3_count;
        sum += in3;
    }
    if (in4_count != seen4) {
        seen4 = in4_count;
        sum += in4;
    }
    /* Sums in a loop grow without bound; restart before they lose precision. */
    if (sum > 1e20) sum = 1.0;
    out1 = sum;
    out1_count++;
    out2 = sum;
    out2_count++;
}
