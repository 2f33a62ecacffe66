"""From methods of a class to functions on a record, with helpers for arrays and logs."""
