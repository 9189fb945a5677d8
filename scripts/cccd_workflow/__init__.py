"""Work on many structures: comparing surfaces and label maps."""
