"""Recovery of runners: adoption of executors, restoration of graphs, restarts after crashes."""
