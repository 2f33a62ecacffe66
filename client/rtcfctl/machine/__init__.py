"""Verbs for the machine and for authors of components: doctor, check, metrics, new."""
