//! The check report as `JUnit` XML, in the subset that CI systems (GitHub, `GitLab`, Jenkins,
//! Azure) share.

use std::time::Duration;

use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite, XmlString};

use super::{Outcome, Report, Verdict};

/// Renders the report as `JUnit` XML.
pub(super) fn junit(report: &Report) -> String {
    let adapter = &report.adapter;
    let name = report.suite.file_stem().unwrap_or_default().to_string_lossy();
    let mut suite = TestSuite::new(valid(&name));
    suite.set_time(Duration::from_secs_f64(report.seconds));
    for (name, value) in [
        ("suite", &*report.suite.to_string_lossy()),
        ("limpid", env!("CARGO_PKG_VERSION")),
        ("adapter", &adapter.name),
        ("driver", &adapter.driver),
        ("backend", &adapter.backend),
    ] {
        suite.add_property((XmlString::new(name), valid(value)));
    }
    suite.add_test_cases(report.outcomes.iter().map(|outcome| case(&name, outcome)));
    let mut suites = quick_junit::Report::new("limpid check");
    suites.set_time(Duration::from_secs_f64(report.seconds)).add_test_suite(suite);
    suites.to_string().expect("a String takes all that is written")
}

fn case(suite: &str, outcome: &Outcome) -> TestCase {
    let unsuccessful = |kind, name| {
        let reasons = outcome.reasons();
        let mut status = TestCaseStatus::non_success(kind);
        status.set_type(name).set_description(valid(&reasons.join("\n")));
        status.set_message(valid(reasons.first().map_or("", String::as_str)));
        status
    };
    let status = match outcome.verdict() {
        Verdict::Failed => unsuccessful(NonSuccessKind::Failure, "failure"),
        Verdict::Error => unsuccessful(NonSuccessKind::Error, "error"),
        Verdict::Passed | Verdict::Blessed => TestCaseStatus::success(),
    };
    let mut case = TestCase::new(valid(&outcome.name), status);
    case.set_classname(valid(suite)).set_time(Duration::from_secs_f64(outcome.seconds));
    let measures: Vec<String> = outcome.measures.iter().map(ToString::to_string).collect();
    if !measures.is_empty() {
        case.set_system_out(valid(&measures.join("\n")));
    }
    case
}

/// Removes the two noncharacters that XML 1.0 forbids and [`XmlString`] keeps.
fn valid(text: &str) -> XmlString {
    XmlString::new(text.replace(['\u{fffe}', '\u{ffff}'], ""))
}

#[cfg(test)]
mod tests {
    use super::super::page::tests::sample;
    use super::*;
    use quick_xml::Reader;
    use quick_xml::events::Event;

    /// Names, messages and adapters with markup, quotes and control characters produce well-formed
    /// XML, and the counts match the elements: CI parsers reject a whole file for one bad
    /// character.
    #[test]
    fn well_formed_and_escaped() {
        let mut report = sample();
        let hostile = "<a href=\"'x'\">&amp;\u{0}\u{1b}[31m\u{b}\u{ffff}]]>\u{1f4a7}";
        report.adapter.name = hostile.into();
        report.outcomes[1].problems.push(hostile.into());
        report.outcomes[1].problems.rotate_right(1);
        let xml = junit(&report);
        let forbidden = |c: char| c < ' ' && !"\t\n\r".contains(c) || c == '\u{ffff}';
        assert!(!xml.chars().any(forbidden), "{xml}");
        let mut reader = Reader::from_str(&xml);
        let (mut elements, mut texts) = (Vec::new(), String::new());
        loop {
            match reader.read_event().expect("well-formed") {
                Event::Eof => break,
                Event::Start(e) | Event::Empty(e) => {
                    for attribute in e.attributes() {
                        let attribute = attribute.expect("well-formed");
                        let value = String::from_utf8_lossy(&attribute.value).into_owned();
                        assert!(!value.contains('<'), "{value}");
                    }
                    elements.push(String::from_utf8_lossy(e.name().as_ref()).into_owned());
                }
                Event::Text(e) => texts += &String::from_utf8_lossy(&e),
                _ => {}
            }
        }
        let count = |name: &str| elements.iter().filter(|e| *e == name).count();
        assert_eq!((count("testsuites"), count("testsuite"), count("properties")), (1, 1, 1));
        assert_eq!(count("testcase"), report.outcomes.len());
        assert_eq!((count("failure"), count("error")), (1, 1));
        assert!(xml.contains("tests=\"3\" skipped=\"0\" failures=\"1\" errors=\"1\""), "{xml}");
        assert!(xml.contains("&lt;a href") && xml.contains("\u{1f4a7}"), "{xml}");
    }

    /// Failed cases contain the reason and the measures; passed cases no message.
    #[test]
    fn failures_have_messages() {
        let xml = junit(&sample());
        assert!(xml.contains("<failure message=\"mean FLIP 0.5 (at most 0.01)\""), "{xml}");
        assert!(xml.contains("<error message=\"a.png: 4x4 pixels\""), "{xml}");
        let passed = xml.split("<testcase").nth(1).expect("a case");
        assert!(passed.contains("name=\"good\"") && !passed.contains("message"), "{passed}");
    }
}
