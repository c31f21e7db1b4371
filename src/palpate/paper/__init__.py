"""The experiments of Haddadi & Hashtrudi-Zaad (2012), on the laboratory's rig."""
