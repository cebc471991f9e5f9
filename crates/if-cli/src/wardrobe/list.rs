//! `ifg wardrobe list`.

use super::opening::open;
use crate::end::End;
use crate::print::{print, print_json};
use crate::table::{coloured, new_table};
use clap::Args;
use if_pipeline::asset::AssetInfo;
use if_pipeline::wardrobe::Unreadable;
use miette::Report;
use serde_json::json;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct ListArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Print one JSON object, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Runs the command. Bodies and garments that cannot be read are told of on stderr, and in the exit
/// code.
pub(super) fn run(args: &ListArgs) -> Result<End, Report> {
    let wardrobe = open(&args.root)?;
    let is_lone = |name: &str, info: &AssetInfo| wardrobe.body_like(name, &info.body).is_err();
    if args.json {
        let fault = |f: &Unreadable| json!({"part": f.part.to_string(), "name": f.name, "error": f.error.to_string()});
        let faults: Vec<_> = wardrobe.faults().iter().map(fault).collect();
        let lone: Vec<_> = wardrobe
            .garments()
            .iter()
            .filter(|(name, info)| is_lone(name, info))
            .map(|(name, _)| name)
            .collect();
        print_json(&json!({
            "bodies": wardrobe.bodies(),
            "garments": wardrobe.garments(),
            "without_body": lone,
            "faults": faults,
        }))?;
    } else {
        let head =
            ["garment", "worn as", "order", "made on", "triangles", "openings", "weights", "φ"];
        let mut table = new_table(&head, 4, coloured());
        for (name, info) in wardrobe.garments() {
            let phi = [(&info.phi.network, "network"), (&info.phi.baked, "baked")];
            let phi: Vec<&str> =
                phi.iter().filter(|(file, _)| file.is_some()).map(|(_, word)| *word).collect();
            table.add_row([
                name.clone(),
                format!("{:?}", info.layer.class).to_lowercase(),
                info.layer.order.to_string(),
                format!(
                    "{}{}",
                    info.body.name,
                    if is_lone(name, info) { " (not there)" } else { "" }
                ),
                info.triangles.to_string(),
                info.openings.len().to_string(),
                if info.skinned { "yes" } else { "no" }.to_owned(),
                phi.join(", "),
            ]);
        }
        let bodies: Vec<&str> = wardrobe.bodies().keys().map(String::as_str).collect();
        print(&format!("Bodies: {}\n{table}\n", bodies.join(", ")))?;
    }
    Ok(if wardrobe.faults().is_empty() { End::Clean } else { End::Unusable })
}
