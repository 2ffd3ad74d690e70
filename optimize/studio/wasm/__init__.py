"""Build of `chain.wasm`: the kernels as WebAssembly, for the page (`make wasm`)."""
