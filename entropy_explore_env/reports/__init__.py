"""What a person looks at: figures, records and pictures of missions."""
