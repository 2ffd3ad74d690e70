"""Methods that know how good rows look: `auto`, and what stands where."""
