#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pcadlang_fuzz::ply(bytes));
