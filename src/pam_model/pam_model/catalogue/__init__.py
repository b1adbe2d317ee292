"""The catalogue of all models: what each is, its domain, when to use it, and its pictures."""
