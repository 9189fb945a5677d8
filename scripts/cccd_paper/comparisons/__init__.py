"""Everything CCCD is compared with, on the same structures in the same run."""
