"""What scans from viewpoints should bring, and how soon: by a robot's own belief."""
