component rtcf_sum "Sums its inputs, new or old: the simple variant in LinuxCNC HAL";
pin in float in1;
pin in float in2;
pin in float in3;
pin in float in4;
pin out float out1;
pin out float out2;
function _;
license "MIT";
;;
FUNCTION(_) {
    double sum = in1 + in2 + in3 + in4;
    /* Sums in a loop grow without bound; restart before they lose precision. */
    if (sum > 1e20) sum = 1.0;
    out1 = sum;
    out2 = sum;
}
