"""Where the links of a model are."""
