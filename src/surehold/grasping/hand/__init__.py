"""What grasps: the iCub's hands and hands described by files."""
