"""From an object file to a library of components, by a C++ shim around it."""
