"""What tests share: shapes with known answers, scans, plans."""
