"""Write `chain.wasm`, the kernels as WebAssembly: `make wasm`, two minutes.

Numba translates the functions of `functions.py` to LLVM code, without optimisation, which would use
instructions of this processor. LLVM optimises it for WebAssembly, `wasm-ld` links it with
`runtime.c`, which stands for Numba's runtime, and `wasm-opt` of Binaryen halves size and run time.
"""

import hashlib
import os
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numba

ROOT = Path(__file__).parents[3]
FOLDER = Path(__file__).parent
MODULE = FOLDER.parent / "chain.wasm"
SOURCES = [
    *sorted((ROOT / "domino_env/kernels").rglob("*.py")),
    *(ROOT / name for name in ("domino_env/physics/motion.py", "domino_env/rigid/dynamics.py")),
    *(FOLDER / name for name in ("build.py", "functions.py", "runtime.c")),
]
SECTION = b"stamp"  # name of the section of the module that has the stamp
FEATURES = {  # names of LLVM, and of Binaryen
    "simd128": "simd",
    "bulk-memory": "bulk-memory",
    "nontrapping-fptoint": "nontrapping-float-to-int",
    "sign-ext": "sign-ext",
}
# what the module imports; JavaScript gives its own
MATHS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log10")
OPTIMISER = ("npx", "--yes", "--package=binaryen@132.0.0", "wasm-opt")


def stamp() -> bytes:
    """Return the digest of the files from which the module is made."""
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in SOURCES)).digest()


def stamp_section() -> bytes:
    """Return the section at the end of the module, which has the stamp."""
    content = bytes([len(SECTION)]) + SECTION + stamp()
    return bytes([0, len(content)]) + content


def llvm_code(folder: str) -> dict[str, str]:
    """Return the LLVM code of each exported function."""
    # machine code of other runs is not unoptimised code
    os.environ |= {"NUMBA_OPT": "0", "NUMBA_CACHE_DIR": folder, "NUMBA_CPU_NAME": "generic"}
    import domino_env.kernels.jit as compilation

    compilation._FAST = None  # the public compilation
    warnings.simplefilter("ignore")  # what is not cached
    from optimize.studio.wasm.functions import FUNCTIONS

    return {
        name: function.inspect_llvm().replace(function.native_name, f"run_{name}")
        for name, function in FUNCTIONS.items()
    }


def object_code(codes: dict[str, str]) -> bytes:
    """Return the object file for WebAssembly of all functions."""
    from llvmlite import binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target: Any = llvm.Target.from_triple("wasm32-unknown-unknown")
    features = ",".join(f"+{feature}" for feature in FEATURES)
    machine = target.create_target_machine(
        opt=3, reloc="static", codemodel="default", features=features
    )
    modules = []
    for code in codes.values():
        # WebAssembly has no common symbols
        text = re.sub(
            r"= common (local_unnamed_addr |dso_local )?global", "= internal global", code
        )
        text = re.sub(
            r"target datalayout = .*", f'target datalayout = "{machine.target_data}"', text
        )
        text = re.sub(r"target triple = .*", 'target triple = "wasm32-unknown-unknown"', text)
        modules.append(llvm.parse_assembly(re.sub(r'"target-(cpu|features)"="[^"]*"', "", text)))
    whole: Any = modules[0]
    for module in modules[1:]:
        whole.link_in(module)
    whole.verify()
    for function in whole.functions:
        if not function.is_declaration and not function.name.startswith("run_"):
            function.linkage = "internal"
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = tuning.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(whole, builder)
    return bytes(machine.emit_object(whole))


def without_paths(module: bytes) -> bytes:
    """Return a module with slashes in place of the folders of this computer.

    They are in texts of errors that the module cannot raise, and keep their lengths, so that all
    else stays at its place.
    """
    for path in (Path(numba.__file__).parents[1], ROOT):  # the first may be inside
        folder = f"{path}/".encode()
        module = module.replace(folder, b"/" * len(folder))
    return module


def main() -> None:
    """Write the module."""
    with tempfile.TemporaryDirectory() as folder:
        names = "chain.o", "runtime.o", "chain.wasm", "imports.txt"
        chain, runtime, module, imports = (str(Path(folder, name)) for name in names)
        codes = llvm_code(folder)
        Path(chain).write_bytes(object_code(codes))
        Path(imports).write_text("\n".join(MATHS))
        zig, run = (sys.executable, "-m", "ziglang"), subprocess.check_call
        source = str(FOLDER / "runtime.c")
        run([*zig, "cc", "-target", "wasm32-freestanding", "-O2", "-c", source, "-o", runtime])
        linking = "--no-entry", "--gc-sections", "--strip-all", f"--allow-undefined-file={imports}"
        exports = [f"--export=run_{name}" for name in codes]
        run([*zig, "wasm-ld", *linking, *exports, chain, runtime, "-o", module])
        flags = [f"--enable-{name}" for name in FEATURES.values()]
        run([*OPTIMISER, "-O3", *flags, module, "-o", module])
        MODULE.write_bytes(without_paths(Path(module).read_bytes()) + stamp_section())


if __name__ == "__main__":
    main()
