//! The command `limpid settings`.

use limpid::settings::Settings;
use limpid_io::project::controls::{CONTROLS, Control, ControlKind, PASSES};
use serde::Serialize;

use crate::terminal;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// List the settings of one pass: classify, layers, smooth, refract, caustics or tonemap.
    #[arg(value_parser = PASSES.map(|(pass, _)| pass))]
    pass: Option<String>,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

/// A setting, for programs.
#[derive(Serialize)]
struct SettingInfo {
    /// As `--set` takes it.
    name: String,
    default: String,
    /// The values that it can have, with their unit.
    range: String,
    help: &'static str,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let settings = Settings::default();
    let passes = PASSES.iter().filter(|(pass, _)| args.pass.as_ref().is_none_or(|p| p == pass));
    if args.json {
        let of_passes =
            passes.flat_map(|(pass, _)| CONTROLS.iter().filter(|control| control.pass == *pass));
        let info = of_passes.map(|control| SettingInfo {
            name: control.path(),
            default: control.get(&settings).to_string(),
            range: range(control, &settings),
            help: control.help,
        });
        terminal::print(&serde_json::to_string_pretty(&info.collect::<Vec<_>>())?)?;
        return Ok(crate::SUCCESS);
    }
    let sections: Vec<String> = passes
        .map(|(pass, title)| {
            let controls = CONTROLS.iter().filter(|control| control.pass == *pass);
            let lines = controls.map(|control| described(control, &settings));
            format!("{title}\n{}", lines.collect::<Vec<_>>().join("\n"))
        })
        .collect();
    terminal::print(&sections.join("\n\n"))?;
    Ok(crate::SUCCESS)
}

/// A setting with its default, its range and its meaning.
fn described(control: &Control, settings: &Settings) -> String {
    let assignment = format!("{}={}", control.path(), control.get(settings));
    let range = range(control, settings);
    format!("  {assignment:<34} {range}\n      {}", control.help)
}

/// The values that a setting can have, with their unit.
pub(crate) fn range(control: &Control, settings: &Settings) -> String {
    let unit = control.unit(settings);
    let with_unit = |range: String| if unit.is_empty() { range } else { format!("{range} {unit}") };
    match control.kind {
        ControlKind::Number(low, high, _) => with_unit(format!("{low} to {high}")),
        ControlKind::Whole(low, high, _) => with_unit(format!("{low} to {high}")),
        ControlKind::Odd(low, high, _) => with_unit(format!("{low} to {high}, odd")),
        ControlKind::Toggle => "true or false".into(),
        ControlKind::Choice(names) => names.join(" | "),
    }
}
