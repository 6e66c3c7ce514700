"""What tests compare with besides the oracle: Pinocchio and MuJoCo beside a robot, identities at a state."""
