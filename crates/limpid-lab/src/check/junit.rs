//! The check report as `JUnit` XML, in the subset that CI systems (GitHub, `GitLab`, Jenkins,
//! Azure) share.

use std::borrow::Cow;
use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::{Outcome, Report, Verdict};

/// Renders the report as `JUnit` XML.
pub(super) fn junit(report: &Report) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    write(&mut writer, report).expect("memory takes what is written");
    String::from_utf8_lossy(&writer.into_inner()).into_owned() + "\n"
}

fn write(writer: &mut Writer<Vec<u8>>, report: &Report) -> io::Result<()> {
    let count = |verdict| report.count(verdict).to_string();
    let (failures, errors) = (count(Verdict::Failed), count(Verdict::Error));
    let tests = report.outcomes.len().to_string();
    let time = format!("{:.3}", report.seconds);
    let suite = plain(&report.suite.display().to_string()).into_owned();
    let name = report.suite.file_stem().unwrap_or_default().to_string_lossy();
    let name = plain(&name);
    let totals =
        [("tests", tests.as_str()), ("failures", &failures), ("errors", &errors), ("time", &time)];
    let adapter = &report.adapter;
    let properties = [
        ("suite", suite.as_str()),
        ("limpid", env!("CARGO_PKG_VERSION")),
        ("adapter", &adapter.name),
        ("driver", &adapter.driver),
        ("backend", &adapter.backend),
    ];
    writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let all = writer.create_element("testsuites").with_attribute(("name", "limpid check"));
    all.with_attributes(totals).write_inner_content(|writer| {
        let suite = writer.create_element("testsuite").with_attribute(("name", &*name));
        suite.with_attributes(totals).write_inner_content(|writer| {
            writer.create_element("properties").write_inner_content(|writer| {
                for (name, value) in properties {
                    let property = writer.create_element("property").with_attribute(("name", name));
                    property.with_attribute(("value", &*plain(value))).write_empty()?;
                }
                Ok(())
            })?;
            report.outcomes.iter().try_for_each(|outcome| case(writer, &name, outcome))
        })?;
        Ok(())
    })?;
    Ok(())
}

fn case(writer: &mut Writer<Vec<u8>>, suite: &str, outcome: &Outcome) -> io::Result<()> {
    let time = format!("{:.3}", outcome.seconds);
    let attributes =
        [("name", outcome.name.as_str()), ("classname", suite), ("time", time.as_str())];
    let case = writer.create_element("testcase").with_attributes(attributes);
    let reasons = outcome.reasons();
    let kind = match outcome.verdict() {
        Verdict::Failed => "failure",
        Verdict::Error => "error",
        Verdict::Passed | Verdict::Blessed => "",
    };
    let measures: Vec<String> = outcome.measures.iter().map(ToString::to_string).collect();
    case.write_inner_content(|writer| {
        if !kind.is_empty() {
            let message = reasons.first().map_or("", String::as_str);
            let element = writer.create_element(kind).with_attribute(("message", &*plain(message)));
            let text = reasons.join("\n");
            let element = element.with_attribute(("type", kind));
            element.write_text_content(BytesText::new(&plain(&text)))?;
        }
        if !measures.is_empty() {
            let text = measures.join("\n");
            let text = BytesText::new(&plain(&text)).into_owned();
            writer.create_element("system-out").write_text_content(text)?;
        }
        Ok(())
    })?;
    Ok(())
}

/// Replaces the characters that XML 1.0 does not allow, even escaped.
fn plain(text: &str) -> Cow<'_, str> {
    let is_allowed = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..);
    match text.chars().all(is_allowed) {
        true => text.into(),
        false => text.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect(),
    }
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
        assert!(xml.contains("tests=\"3\" failures=\"1\" errors=\"1\""), "{xml}");
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
