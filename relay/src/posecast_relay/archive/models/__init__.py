"""Models in an object store, kept while a segment there names them."""
