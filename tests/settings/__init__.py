"""Tests of settings; a package, since some names of files are those of other folders, too."""
