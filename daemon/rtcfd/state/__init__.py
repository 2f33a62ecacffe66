"""The state that outlives a process: desired states on disk, and the handover to the next rtcfd."""
