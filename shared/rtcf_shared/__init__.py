"""What the daemon and its clients share: words, graph files, folders of components."""
