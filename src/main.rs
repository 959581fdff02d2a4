//! The `flexura` command: reads arguments and files, calls the library, writes and shows what it gives.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
