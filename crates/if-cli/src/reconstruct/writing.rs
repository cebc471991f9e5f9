//! What a run writes into the wardrobe.

use super::finished::REPORT;
use super::written::Written;
use super::{MotionFrom, PROVENANCE, ReconstructArgs, names, page};
use if_body::TemplateBody;
use if_mesh::atomic::FolderWriter;
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams};
use if_pipeline::asset::{LayerHint, Parts, Provenance};
use if_pipeline::capture::{Capture, write_poses};
use if_pipeline::reconstruct::{Reconstruction, write_frames};
use if_pipeline::wardrobe::{NewBody, Wardrobe, WardrobeError};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What a reconstruction is made of, it, and its provenance.
pub(super) type Made<'a> = (&'a Capture, &'a Reconstruction, &'a Provenance);

/// The files of a template body that a wardrobe takes.
pub(super) struct BodyPaths {
    pub(super) name: String,
    pub(super) mesh: PathBuf,
    pub(super) template: Option<PathBuf>,
    pub(super) skeleton: Option<PathBuf>,
}

impl BodyPaths {
    pub(super) fn of(folder: &Path, name: Option<&str>) -> Self {
        let file = |name: &str| Some(folder.join(name)).filter(|p| p.is_file());
        Self {
            name: name.map_or_else(|| names::last_name(folder, "body"), str::to_owned),
            mesh: file("body_clean.ply").unwrap_or_else(|| folder.join("body.ply")),
            template: file("body.ply"),
            skeleton: file("skeleton.json"),
        }
    }

    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        [Some(&self.mesh), self.template.as_ref(), self.skeleton.as_ref()]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
    }

    pub(super) fn body(&self) -> NewBody<'_> {
        NewBody {
            template: self.template.as_deref(),
            skeleton: self.skeleton.as_deref(),
            ..NewBody::new(&self.name, &self.mesh)
        }
    }
}

/// The body and the garments, into the wardrobe. Returns their names, and those of garments that stay from
/// an earlier reconstruction.
pub(super) fn write_assets(
    (mut wardrobe, body): (Wardrobe, &NewBody),
    names: &[String],
    (capture, found, provenance): Made<'_>,
    network: Option<&[u8]>,
) -> Result<(Written, Vec<String>), WardrobeError> {
    let body = wardrobe.add_body_once(body)?;
    let mut made = vec![false; names.len()];
    for garment in &found.garments {
        let k = capture
            .garments()
            .iter()
            .position(|n| *n == garment.name)
            .expect("garments are the capture's");
        made[k] = true;
        wardrobe.add(&Parts {
            name: &names[k],
            hint: LayerHint::of_name(&garment.name),
            body: &body,
            mesh: &garment.mesh,
            skin: Some(&garment.skin),
            beside: None,
            provenance,
            network,
            baked: garment.phi.as_ref(),
        })?;
    }
    let stays = |(name, made): &(&String, bool)| !made && wardrobe.garments().contains_key(*name);
    let named = || names.iter().zip(made.iter().copied());
    let earlier = named().filter(stays).map(|(name, _)| name.clone()).collect();
    let garments = named().filter(|(_, made)| *made).map(|(name, _)| name.clone()).collect();
    Ok((Written { body: body.name, garments, ..Written::default() }, earlier))
}

/// The clothed body with its labels, a report, and where asked for the frames.
pub(super) fn write_clothed(
    args: &ReconstructArgs,
    (writer, name): (&FolderWriter, &str),
    (capture, found, provenance): Made<'_>,
    template: &TemplateBody,
    record: impl FnOnce(&Path) -> io::Result<()>,
) -> io::Result<()> {
    let corrected = found.corrected(capture).map_err(io::Error::other)?;
    writer.write(name, |folder| {
        let mut properties = found.skin.to_properties();
        properties.push(Property::new("label", Column::U8(found.labels.clone())));
        let file = PlyMesh { vertex_properties: properties, ..PlyMesh::new(found.mesh.clone()) };
        let path: PathBuf = folder.join("canonical.ply");
        ply::write_path(&file, found.mesh.vertices(), &WriteParams::default(), &path)
            .map_err(io::Error::other)?;
        if args.frames {
            write_frames(
                &folder.join("frames"),
                &found.mesh,
                &found.skin,
                &template.skeleton,
                &corrected,
                found.motion.as_ref().filter(|_| args.motion == MotionFrom::Solved),
            )
            .map_err(io::Error::other)?;
        }
        if let Some(fields) = &found.fields {
            fs::write(folder.join("phi.safetensors"), fields.phi_bytes()?)?;
            fs::write(folder.join("deformation.safetensors"), fields.deformation_bytes()?)?;
        }
        if let Some(network) = &found.motion_network {
            fs::write(folder.join("deformation.safetensors"), network.to_bytes()?)?;
        }
        if let Some(poses) = &found.poses {
            let numbered = poses.iter().enumerate().map(|(k, pose)| (capture.number(k), pose));
            let path = folder.join("poses.json");
            write_poses(&path, capture.joints(), corrected.camera(), numbered)
                .map_err(io::Error::other)?;
        }
        fs::write(folder.join(PROVENANCE), serde_json::to_vec_pretty(provenance)?)?;
        fs::write(folder.join(REPORT), serde_json::to_vec_pretty(&found.report)?)?;
        fs::write(folder.join("report.html"), page::page(name, found)?)?;
        record(folder)
    })
}
