"""How an executor gets its graph again: adopted, restored, or after a crash."""
