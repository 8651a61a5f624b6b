"""From a sample to a frame and its events: checked, flattened, sampled, paced, encoded. No I/O."""
