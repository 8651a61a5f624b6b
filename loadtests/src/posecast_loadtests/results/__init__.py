"""What each viewer checks, what is counted of it in all processes, and the verdict on the counts."""
