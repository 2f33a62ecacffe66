"""The code shared by the daemon and its clients: names, graph files, component folders."""
