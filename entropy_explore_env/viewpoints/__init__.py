"""Drawing candidate viewpoints, and what scans from them should bring: by a robot's own belief."""
