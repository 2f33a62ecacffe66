"""From object files to a library of components: tables, adapters of messages, and the runtime."""
