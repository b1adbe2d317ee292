"""The answer of a diagnosis: JSON, the report page and the improved rig file."""
