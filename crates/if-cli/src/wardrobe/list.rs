//! `ifg wardrobe list`.

use super::args::ListArgs;
use super::open;
use crate::end::End;
use crate::print::{print, print_json};
use crate::table::{coloured, new_table};
use miette::Report;
use serde_json::json;

/// Runs the command. Garments that cannot be read are told of on stderr, and in the exit code.
pub(super) fn run(args: &ListArgs) -> Result<End, Report> {
    let wardrobe = open(&args.root)?;
    if args.json {
        let faults: Vec<_> = wardrobe.faults().iter().map(|(name, e)| json!({"name": name, "error": e.to_string()})).collect();
        print_json(&json!({"bodies": wardrobe.bodies(), "garments": wardrobe.garments(), "faults": faults}))?;
    } else {
        let head = ["garment", "worn as", "order", "made on", "triangles", "openings", "weights", "φ"];
        let mut table = new_table(&head, 4, coloured());
        for (name, info) in wardrobe.garments() {
            let phi = [(&info.phi.network, "network"), (&info.phi.baked, "baked")];
            let phi: Vec<&str> = phi.iter().filter(|(file, _)| file.is_some()).map(|(_, word)| *word).collect();
            table.add_row([
                name.clone(),
                format!("{:?}", info.layer.class).to_lowercase(),
                info.layer.order.to_string(),
                info.body.name.clone(),
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
