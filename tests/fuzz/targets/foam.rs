#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| limpid_fuzz::particles(".positions", bytes));
