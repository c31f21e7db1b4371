"""What follows from an identified law: impacts, energy, passivity and elastic modulus."""
