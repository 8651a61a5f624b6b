"""The guide: builds docs/ into a static site. See tools/site/__main__.py."""
