"""How long the sentences of the documentation are, and how easy it is to read."""
