"""What the crew reads in flight, one module per subject: to be read in one sitting, and translated."""
