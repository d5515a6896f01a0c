"""The blend of the schedule model: its members, their weights by lead, and how they go through rows."""
