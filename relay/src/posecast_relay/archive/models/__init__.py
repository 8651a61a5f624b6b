"""Models in an object store: kept as long as a segment there names them."""
