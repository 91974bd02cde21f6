//! On macOS a module leaves the symbols of Python open only if its linker is told to; elsewhere this does nothing.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
