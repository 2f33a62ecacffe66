"""The gRPC service of rtcfd."""
