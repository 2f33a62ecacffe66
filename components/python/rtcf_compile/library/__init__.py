"""Links object files to a component library: tables, message adapters and the runtime."""
