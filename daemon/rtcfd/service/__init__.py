"""The gRPC face of rtcfd."""
