"""Sources of samples: each kind is a module that offers `open_source`."""
