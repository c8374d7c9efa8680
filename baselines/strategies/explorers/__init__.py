"""Rules of exploration as their authors run them: every frontier cell counts, and each call decides anew."""
