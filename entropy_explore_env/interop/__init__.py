"""Files and messages of other programs: maps as files, ROS's messages and bags."""
