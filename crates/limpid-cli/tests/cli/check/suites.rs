//! Suites: errors in them, and which tolerance counts.

use limpid_io::error::Category;
use limpid_lab::check::{Adapter, Suite};

/// An error in a suite is refused before anything is drawn, with its line, the key and the nearest valid
/// one.
#[test]
fn errors_in_suites() {
    let frame = "[[frame]]\nname = \"a\"\ninput = \"b.toml\"\n";
    let cases: &[(&str, &[&str])] = &[
        ("", &["nothing to check", "[[frame]]"]),
        ("[tolerance]\nmean_flip = 0.1\n", &["nothing to check"]),
        ("[[frame]\n", &["line 1"]),
        ("[[fram]]\nname = 1\n", &["line 1", "`fram`", "did you mean `frame`?"]),
        ("FRAME\nimput = 1\n", &["line 5", "`imput`", "did you mean `input`?"]),
        ("FRAME\naov = { dept = {} }\n", &["`dept`", "did you mean `depth`?"]),
        ("FRAME\naov = { depth = { withn = 1 } }\n", &["`withn`", "did you mean `within`?"]),
        ("FRAME\ntolerance = { mean_flop = 1 }\n", &["did you mean `mean_flip`?"]),
        ("FRAME\nbake = { second = 1 }\n", &["did you mean `seconds`?"]),
        ("[tolerance]\nmean_flip = nan\nFRAME", &["[tolerance]", "mean_flip is NaN", "0 to 1"]),
        ("[tolerance]\nmean_flip = -0.1\nFRAME", &["mean_flip is -0.1"]),
        ("[tolerance]\np99_flip = 1.5\nFRAME", &["p99_flip is 1.5"]),
        ("[tolerance]\nmax_channel_error = -1\nFRAME", &["line 2", "-1"]),
        ("[tolerance]\nmax_channel_error = 256\nFRAME", &["line 2", "256"]),
        ("[tolerance]\ntemporal = 0.9\nFRAME", &["temporal is 0.9"]),
        ("[tolerance]\ntemporal = nan\nFRAME", &["temporal is NaN"]),
        ("FRAME\ntolerance = { p99_flip = nan }\n", &["`a`", "tolerance.p99_flip is NaN"]),
        ("FRAME\naov = { depth = { share = 2 } }\n", &["aov.depth.share is 2"]),
        ("FRAME\naov = { depth = { within = nan } }\n", &["aov.depth.within is NaN"]),
        ("FRAME\naov = { depth = { mean = -1 } }\n", &["aov.depth.mean is -1"]),
        ("FRAME\naov = { depth = { p99 = inf } }\n", &["aov.depth.p99 is inf"]),
        ("[[adapter]]\nname = \"\"\nFRAME", &["[[adapter]] name"]),
        ("[[adapter]]\nname = \"x\"\nmean_flip = nan\nFRAME", &["`x`", "mean_flip is NaN"]),
        ("FRAME\nbake = { seconds = -1 }\n", &["bake.seconds is -1"]),
        ("FRAME\nbake = { seconds = inf }\n", &["bake.seconds is inf"]),
        ("FRAME\nsize = [0, 10]\n", &["size", "0x10"]),
        ("FRAME\nframe = 1\nat = 2.5\n", &["one of frame and at"]),
        ("FRAME\nat = nan\n", &["at must be finite"]),
        ("FRAME\nframes = \"1-3\"\n", &["`frames` is a key of [[sequence]]"]),
        ("SEQUENCE\nframe = 1\n", &["`frame` is a key of [[frame]]"]),
        ("SEQUENCE\naov = {}\n", &["`aov` is a key of [[frame]]"]),
        ("SEQUENCE\nframes = \"3-\"\n", &["[[sequence]] `a`", "`3-`"]),
        ("SEQUENCE\nexpected = \"a.png\"\n", &["a.png", "####"]),
        ("FRAME\nFRAME", &["two entries are named `a`"]),
        ("FRAME\nSEQUENCE", &["two entries are named `a`"]),
        ("[[frame]]\nname = \"../a\"\ninput = \"b\"\n", &["letters"]),
        ("[[frame]]\nname = \"\"\ninput = \"b\"\n", &["letters"]),
        ("[[frame]]\nname = \"a\"\n", &["missing field `input`"]),
    ];
    for (text, parts) in cases {
        let text = text.replace("FRAME", frame);
        let text = text.replace("SEQUENCE", &frame.replace("frame", "sequence"));
        let error = Suite::parse(&text, "tests/suite.toml".as_ref()).expect_err(&text);
        assert_eq!(error.category(), Category::Request, "{error}");
        let message = error.to_string();
        assert!(message.starts_with("tests/suite.toml"), "{message}");
        for part in *parts {
            assert!(message.contains(part), "`{part}` is not in `{message}`:\n{text}");
        }
    }
    let missing = Suite::load("nowhere.toml".as_ref()).expect_err("no file");
    assert_eq!(missing.category(), Category::Data);
}

/// Precedence of tolerances: the entry's for the adapter, the entry's, the suite's for the adapter, the
/// suite's, the default.
#[test]
fn precedence_of_tolerances() {
    let suite = r#"
        [tolerance]
        mean_flip = 0.1
        p99_flip = 0.5
        [[adapter]]
        name = "LLVMpipe"
        mean_flip = 0.01
        temporal = 1.5
        [[adapter]]
        name = "Mesa 25"
        max_channel_error = 9
        [[frame]]
        name = "plain"
        input = "a.toml"
        [[frame]]
        name = "own"
        input = "a.toml"
        tolerance.mean_flip = 0.2
        [[frame.adapter]]
        name = "geforce"
        mean_flip = 0.3
    "#;
    let suite = Suite::parse(suite, "a.toml".as_ref()).expect("a suite");
    let tolerance = |entry: usize, name: &str, driver: &str| {
        let (name, driver) = (name.to_owned(), driver.to_owned());
        let adapter = Adapter { name, driver, backend: "vulkan".into() };
        suite.tolerance(&suite.entries[entry], &adapter)
    };
    let mesa = tolerance(0, "llvmpipe (LLVM 19.1.7, 256 bits)", "llvmpipe Mesa 25.0.7");
    assert_eq!((mesa.mean_flip, mesa.p99_flip, mesa.temporal), (0.01, 0.5, 1.5));
    assert_eq!(mesa.max_channel_error, 9);
    let other = tolerance(0, "NVIDIA GeForce RTX", "580");
    assert_eq!((other.mean_flip, other.max_channel_error, other.temporal), (0.1, 255, 1.1));
    assert_eq!(tolerance(1, "llvmpipe", "").mean_flip, 0.2);
    assert_eq!(tolerance(1, "NVIDIA GeForce RTX", "580").mean_flip, 0.3);
}
