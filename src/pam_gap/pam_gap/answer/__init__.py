"""What a diagnosis says: JSON, the report page and the improved rig file."""
