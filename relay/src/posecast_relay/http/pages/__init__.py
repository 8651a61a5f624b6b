"""Built files over HTTP: the page, and the guide."""
