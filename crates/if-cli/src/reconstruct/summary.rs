//! What a reconstruction found, for people.

use if_pipeline::reconstruct::{
    FieldsReport, LabelContradiction, MotionReport, PoseReport, ReconstructReport, Residual,
    SurfaceReport,
};

/// A line for each stage.
pub(super) fn summary(name: &str, report: &ReconstructReport, seconds: f64) -> String {
    let surface = &report.surface;
    let used = surface.frames - surface.skipped.len();
    let mut text = format!(
        "{name}: {used} of {} frames, {} triangles, {seconds:.1} s\n",
        surface.frames, report.triangles
    );
    if let Some(filled) = &surface.start.filled {
        text += &format!(
            "  {} hangs loose about {}: {:.1} litres were filled\n",
            filled.garments.join(" and "),
            filled.joints.join(", "),
            filled.litres
        );
    }
    if let Some(poses) = &report.poses {
        text += &format!("  {}", refined(poses));
    }
    let pixels = &surface.pixels;
    if let Some(last) = surface.rounds.last() {
        text += &format!("  silhouettes were off by {:.1} mm", last.silhouette_mm);
        if pixels.used > 0 {
            text += &format!(" and normals by {:.1}°", last.normal_degrees);
        }
        text += " before the last round\n";
    }
    for warning in warnings(report) {
        text += &format!("  {warning}\n");
    }
    if let Some(fields) = &report.fields {
        text += &format!("  {}", trained(fields));
    } else if let Some(motion) = &report.motion {
        text += &format!("  {}", moved(motion));
    }
    if let Some(network) = &report.motion_network {
        text += &format!(
            "  their motion as a network: off by {:.2} mm on average, for {:.2} mm of none at all\n",
            network.mean_mm, network.still_mm
        );
    }
    if let Some(phi) = &report.phi {
        text += &format!(
            "  φ as a network: off by {:.2} mm on average, 99 % by less than {:.1} mm\n",
            phi.mean_mm, phi.p99_mm
        );
    }
    for wrong in contradictions(&report.labels.contradictions) {
        text += &format!("  {wrong}: there the other frames decide\n");
    }
    for garment in &report.garments {
        text += &format!(
            "  {}: {} triangles, {} openings{}, {} holes filled, {} left{}{}\n",
            garment.name,
            garment.triangles,
            garment.openings,
            match garment.most_openings {
                Some(most) if most > garment.openings =>
                    format!(" (a closed garment of that name has {most})"),
                _ => String::new(),
            },
            garment.filled,
            garment.holes_left,
            match garment.tunnels {
                0 => String::new(),
                n => format!(", {n} tunnels through it"),
            },
            match garment.own_pairs {
                0 => String::new(),
                n => format!(", {n} intersections with itself, for `ifg fix`"),
            }
        );
    }
    text
}

/// Which frames take one label for another, those that follow one another as one.
fn contradictions(all: &[LabelContradiction]) -> Vec<String> {
    let mut runs: Vec<(&LabelContradiction, u32)> = Vec::new();
    for next in all {
        let follows = |(first, last): &&mut (&LabelContradiction, u32)| {
            (&first.label, &first.others) == (&next.label, &next.others) && *last + 1 == next.frame
        };
        match runs.iter_mut().find(follows) {
            Some((_, last)) => *last = next.frame,
            None => runs.push((next, next.frame)),
        }
    }
    let told = |(first, last): (&LabelContradiction, u32)| {
        let (from, label, others) = (first.frame, &first.label, &first.others);
        match last == from {
            true => format!("frame {from} labels most of {others} as {label}"),
            false => format!("frames {from}-{last} label most of {others} as {label}"),
        }
    };
    runs.into_iter().map(told).collect()
}

/// What may be wrong: each fails `--strict`.
pub(super) fn warnings(report: &ReconstructReport) -> Vec<String> {
    let skipped = &report.surface.skipped;
    let more = skipped.len().saturating_sub(NAMED);
    let more = (more > 0).then(|| format!("warning: {more} more frames are not used"));
    let skipped = skipped.iter().take(NAMED).map(|why| format!("warning: {why}; it is not used"));
    let normals = odd_normals(&report.surface);
    let doubted = doubts(&report.surface);
    let resized = report.poses.as_ref().and_then(resized);
    let guessed = report.garments.iter().filter(|g| g.unseen > MOST_UNSEEN).map(|garment| {
        format!(
            "warning: no frame sees {:.0} % of {}: what it has there is a guess; the person must be whole in the pictures, and turn",
            100.0 * garment.unseen,
            garment.name
        )
    });
    let in_pieces = report.garments.iter().filter(|g| g.pieces > 1 && g.most_openings.is_some());
    let in_pieces = in_pieces.map(|garment| {
        format!(
            "warning: {} came out in {} pieces: too little was seen of what lies between them, as under other clothes",
            garment.name, garment.pieces
        )
    });
    let whole = report.garments.iter().filter(|g| g.pieces == 1);
    let closed = whole.filter_map(|garment| {
        let least = garment.least_openings.filter(|least| garment.openings < *least)?;
        Some(format!(
            "warning: {} has {} openings, a garment of that name at least {least}: too little was seen of its ends, or labels, poses or masks are wrong",
            garment.name, garment.openings
        ))
    });
    let torn = report.garments.iter().filter_map(|garment| {
        let most = garment.most_openings.filter(|most| garment.openings > *most)?;
        Some(format!(
            "warning: {} has {} openings, a garment of that name at most {most}: it is torn; too little was seen of it, or poses, labels or masks are wrong",
            garment.name, garment.openings
        ))
    });
    let rims = rims(report.labels.masks_beyond_mm);
    let shown = |name: &String| report.labels.shown.get(name).copied().unwrap_or_default();
    let cut = report.garments.iter().filter_map(|garment| {
        let shown = shown(&garment.name);
        (shown.at_edge as f64 > MOST_AT_EDGE * shown.frames as f64).then(|| {
            format!(
                "warning: the edge of the picture cuts {} in {} of {} label images: where no picture shows it, it ends",
                garment.name, shown.at_edge, shown.frames
            )
        })
    });
    let missing = report.missing.iter().map(|name| match shown(name).frames {
        0 => format!(
            "warning: {name}: not reconstructed, no label image that was read has a pixel of its label"
        ),
        _ => format!(
            "warning: {name}: not reconstructed, too little of it was seen; more frames or pixels may show it"
        ),
    });
    skipped
        .chain(more)
        .chain(normals)
        .chain(doubted)
        .chain(resized)
        .chain(guessed)
        .chain(in_pieces)
        .chain(closed)
        .chain(torn)
        .chain(rims)
        .chain(cut)
        .chain(missing)
        .collect()
}

/// Whether masks and label images disagree about where the person ends. `None` if they do not.
fn rims(masks_beyond_mm: f64) -> Option<String> {
    (masks_beyond_mm.abs() > MOST_BEYOND_MM).then(|| {
        let (where_to, what) = if masks_beyond_mm > 0.0 {
            ("beyond", "too large")
        } else {
            ("less far than", "too small")
        };
        format!(
            "warning: masks reach {:.1} mm {where_to} label images at the median of their rims: if the masks are {what}, so are the clothes",
            masks_beyond_mm.abs()
        )
    })
}

/// What became of the poses, in a line.
fn refined(poses: &PoseReport) -> String {
    let count = poses.joints.len().max(1) as f64;
    let mean = poses.joints.iter().map(|j| j.moved_mm).sum::<f64>() / count;
    let most = poses.joints.iter().map(|j| j.moved_most_mm).fold(0.0, f64::max);
    let mut text = format!(
        "poses were refined: joints moved by {mean:.1} mm on average, {most:.1} mm at most"
    );
    if poses.camera_degrees > 0.0 {
        text += &format!("; the camera was turned by {:.2}°", poses.camera_degrees);
    }
    if poses.camera_zoom != 1.0 {
        text += &format!("; focal lengths were multiplied by {:.3}", poses.camera_zoom);
    }
    if !poses.unused.is_empty() {
        text += &format!("; {} frames follow from their neighbours", poses.unused.len());
    }
    if let Some(held_out) = &poses.held_out {
        text += &format!(
            "\n  frames that the surface had not seen were off by {:.1} mm and {:.1}°",
            held_out.silhouette_mm, held_out.normal_degrees
        );
    }
    text + "\n"
}

/// Whether the focal lengths were so far off that the template's size may be: of these a video shows but
/// the ratio. `None` if they were not.
fn resized(poses: &PoseReport) -> Option<String> {
    let percent = 100.0 * (1.0 / poses.camera_zoom - 1.0);
    (poses.camera_zoom > 0.0 && percent.abs() > MOST_RESIZED).then(|| {
        format!(
            "warning: the body of --body looks {:.0} % {} than the person: it is another one's, of another size, or the camera's focal lengths are wrong; the garments have the body's size",
            percent.abs(),
            if percent > 0.0 { "larger" } else { "smaller" }
        )
    })
}

/// What became of the training of φ and d, in a line.
fn trained(fields: &FieldsReport) -> String {
    let Some(last) = fields.rounds.last() else {
        return "φ and d were not trained: they are those of the surface\n".into();
    };
    let rays = &last.rays;
    let all = (rays.used + rays.grazing + rays.lost + rays.contradicting).max(1);
    let seconds: f64 = fields.rounds.iter().map(|r| r.seconds).sum();
    format!(
        "φ and d were trained in {} steps, {seconds:.0} s: silhouettes off by {:.1} mm, normals by {:.1}°, \
         |d| {:.1} mm; {:.0} % of the rays were used\n",
        last.steps,
        last.silhouette_mm,
        last.normal_degrees,
        last.motion_mm,
        100.0 * rays.used as f64 / all as f64
    )
}

/// Which axis of the normals is flipped, or that they are of something else; `None` if they are as they
/// should be.
fn odd_normals(surface: &SurfaceReport) -> Option<String> {
    let axes = ["x (to the right)", "y (down)", "z (away from the camera)"];
    let flipped = axes.into_iter().zip(surface.normal_axes).filter(|(_, of)| *of < 0.0);
    let flipped: Vec<&str> = flipped.map(|(name, _)| name).collect();
    if !flipped.is_empty() {
        let mirrored = match surface.normal_axes {
            [_, y, z] if y < 0.0 || z < 0.0 => "",
            _ => "; or the pictures are mirrored, as those of a selfie",
        };
        return Some(format!(
            "warning: the normals point the other way than the body along {}: docs/reference/capture.md has their axes{mirrored}",
            flipped.join(" and ")
        ));
    }
    let pixels = &surface.pixels;
    if pixels.person > 0 && pixels.no_normal == pixels.person {
        return Some(
            "warning: no pixel of the person has a normal: the surface is fitted to outlines alone"
                .to_owned(),
        );
    }
    let share = |n: usize| 100.0 * n as f64 / pixels.person.max(1) as f64;
    (pixels.contradicting > pixels.used).then(|| {
        format!(
            "warning: the normals of {:.0} % of the person's pixels contradict the surface, those of {:.0} % were used: are they as docs/reference/capture.md has them?",
            share(pixels.contradicting),
            share(pixels.used)
        )
    })
}

/// Which frames and joints do not match their images; `None` if all do.
fn doubts(surface: &SurfaceReport) -> Option<String> {
    let doubts = &surface.quality.doubts;
    let mut frames: Vec<usize> = doubts.iter().map(|d| d.frame).collect();
    frames.dedup();
    let most =
        |of: fn(&Residual) -> f64| doubts.iter().map(|d| of(&d.residual)).fold(0.0, f64::max);
    // The joints that are doubted in most frames first.
    let mut joints: Vec<(usize, &str)> = Vec::new();
    for name in doubts.iter().filter_map(|d| d.joint.as_deref()) {
        match joints.iter_mut().find(|(_, other)| *other == name) {
            Some((count, _)) => *count += 1,
            None => joints.push((1, name)),
        }
    }
    joints.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let named: Vec<&str> = joints.iter().take(NAMED).map(|(_, name)| *name).collect();
    let (first, rest) = frames.split_first()?;
    let mut text = format!("warning: frame {first}");
    if !rest.is_empty() {
        let listed: Vec<String> = rest.iter().take(NAMED).map(usize::to_string).collect();
        text = format!("warning: frames {first}, {}", listed.join(", "));
        if rest.len() > NAMED {
            text += &format!(" and {} more", rest.len() - NAMED);
        }
    }
    text += " cannot be explained by the surface in these poses";
    if !named.is_empty() {
        text += &format!(", above all at {}", named.join(", "));
        if joints.len() > NAMED {
            text += &format!(" and {} more joints", joints.len() - NAMED);
        }
    }
    Some(format!(
        "{text}: silhouettes are off by up to {:.0} mm, normals by up to {:.0}°, and up to {:.0} % \
         lies outside the mask. Check {}",
        most(|r| r.silhouette_mm),
        most(|r| r.normal_degrees),
        100.0 * most(|r| r.outside),
        match frames.len() + surface.skipped.len() < surface.frames {
            true => "poses, --pose-noise, masks and normals of these frames",
            false =>
                "whether --body is this person's, the camera, and poses, --pose-noise, masks and normals",
        }
    ))
}

/// The share of a garment that no frame sees from which on it is doubted.
const MOST_UNSEEN: f64 = 1.0 / 3.0;

/// By how many per cent the template may be larger or smaller than the person before it is warned of: the
/// focal length is found within one per cent.
const MOST_RESIZED: f64 = 5.0;

/// How far masks and label images may disagree at the median of their rims, in millimetres: in pictures of 256
/// pixels one is 7 mm, and makes clothes as much wider.
const MOST_BEYOND_MM: f64 = 3.0;

/// The share of the label images with a garment that show it at their edge from which on it is warned
/// of: a sleeve may leave the picture now and then.
const MOST_AT_EDGE: f64 = 0.75;

/// Frames and joints that a warning names.
const NAMED: usize = 12;

/// What became of the motion of single frames, in a line.
pub(super) fn moved(motion: &MotionReport) -> String {
    let mut text = format!(
        "{} frames move on their own: {:.1} mm on average, {:.1} mm at most",
        motion.solved, motion.mean_mm, motion.max_mm
    );
    if !motion.skipped.is_empty() {
        text +=
            &format!("; {} bring nothing, and move as their neighbours do", motion.skipped.len());
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_pipeline::reconstruct::{GarmentReport, LabelShown};

    /// A report of trousers that so many of four label images show, and cut at their edge.
    fn trousers(frames: usize, at_edge: usize) -> ReconstructReport {
        let mut shown = LabelShown::default();
        (shown.frames, shown.at_edge) = (frames, at_edge);
        let mut garment = GarmentReport::default();
        garment.name = "trousers".into();
        let mut report = ReconstructReport::default();
        report.labels.shown.insert("trousers".into(), shown);
        report.garments.push(garment);
        report
    }

    #[test]
    fn what_the_pictures_cut_is_named() {
        assert_eq!(warnings(&trousers(4, 3)), [""; 0], "a leg may leave the picture now and then");
        let found = warnings(&trousers(4, 4));
        let [cut] = &found[..] else { panic!("{found:?}") };
        assert!(cut.contains("cuts trousers in 4 of 4 label images"), "{cut}");
    }

    #[test]
    fn frames_that_follow_one_another_are_told_as_one() {
        let of = |frame, others: &str| {
            let mut wrong = LabelContradiction::default();
            (wrong.frame, wrong.label, wrong.others) = (frame, "tshirt".into(), others.into());
            wrong
        };
        let all =
            [of(2, "skin"), of(8, "jacket"), of(9, "jacket"), of(9, "skin"), of(10, "jacket")];
        assert_eq!(
            contradictions(&all),
            [
                "frame 2 labels most of skin as tshirt",
                "frames 8-10 label most of jacket as tshirt",
                "frame 9 labels most of skin as tshirt"
            ]
        );
    }

    #[test]
    fn pieces_of_clothes_that_have_one_are_named_and_tunnels_counted() {
        let told = |report: &ReconstructReport| summary("anna", report, 1.0);
        let mut report = trousers(4, 0);
        (report.garments[0].pieces, report.garments[0].tunnels) = (2, 0);
        assert!(warnings(&report).is_empty(), "what it is nobody knows");
        assert!(!told(&report).contains("tunnels"));
        (report.garments[0].most_openings, report.garments[0].tunnels) = (Some(3), 7);
        let [one] = &warnings(&report)[..] else { panic!("one warning") };
        assert!(one.contains("trousers came out in 2 pieces"), "{one}");
        let told = told(&report);
        assert!(told.contains("0 left, 7 tunnels through it"), "{told}");
        report.garments[0].pieces = 1;
        assert!(warnings(&report).is_empty());
    }

    #[test]
    fn ends_that_are_closed_are_named() {
        let mut report = trousers(4, 0);
        let garment = &mut report.garments[0];
        (garment.pieces, garment.openings, garment.least_openings) = (1, 2, Some(3));
        let [one] = &warnings(&report)[..] else { panic!("one warning") };
        assert!(
            one.contains("trousers has 2 openings, a garment of that name at least 3"),
            "{one}"
        );
        report.garments[0].openings = 3;
        assert!(warnings(&report).is_empty());
        (report.garments[0].openings, report.garments[0].most_openings) = (5, Some(3));
        let [torn] = &warnings(&report)[..] else { panic!("one warning") };
        assert!(
            torn.contains("5 openings, a garment of that name at most 3: it is torn"),
            "{torn}"
        );
    }

    #[test]
    fn masks_that_do_not_fit_the_labels_are_told_and_own_intersections_counted() {
        let mut report = trousers(4, 0);
        report.labels.masks_beyond_mm = 2.0;
        assert!(warnings(&report).is_empty());
        for (beyond, expected) in [(6.8, "6.8 mm beyond label"), (-13.6, "13.6 mm less far than")] {
            report.labels.masks_beyond_mm = beyond;
            let [one] = &warnings(&report)[..] else { panic!("one warning") };
            assert!(one.contains(expected), "{one}");
        }
        assert!(!summary("anna", &report, 1.0).contains("with itself"));
        report.garments[0].own_pairs = 8;
        let told = summary("anna", &report, 1.0);
        assert!(told.contains("0 left, 8 intersections with itself, for `ifg fix`"), "{told}");
    }

    #[test]
    fn a_body_of_another_size_than_the_person_is_named() {
        let found = |zoom| {
            let mut poses = PoseReport::default();
            poses.camera_zoom = zoom;
            let mut report = ReconstructReport::default();
            report.poses = Some(poses);
            warnings(&report)
        };
        let [one] = &found(0.87)[..] else { panic!("one warning") };
        assert!(one.contains("looks 15 % larger than the person"), "{one}");
        assert!(found(1.1)[0].contains("9 % smaller"));
        assert!(found(0.97).is_empty() && found(1.0).is_empty());
    }

    #[test]
    fn what_is_missing_is_named_by_whether_a_label_image_has_it() {
        for (frames, why) in [(0, "no label image that was read"), (2, "too little of it")] {
            let mut report = trousers(frames, 0);
            report.garments.clear();
            report.missing.push("trousers".into());
            let found = warnings(&report);
            let [missing] = &found[..] else { panic!("{found:?}") };
            assert!(missing.contains("trousers: not reconstructed") && missing.contains(why));
        }
    }

    #[test]
    fn flipped_axes_of_normals_are_named_before_what_follows_from_them() {
        let found = |axes| {
            let mut report = ReconstructReport::default();
            report.surface.normal_axes = axes;
            (report.surface.pixels.used, report.surface.pixels.contradicting) = (1, 9);
            report.surface.pixels.person = 10;
            let [one] = &warnings(&report)[..] else { panic!("one warning") };
            one.clone()
        };
        let flipped = found([0.9, -0.8, -0.9]);
        assert!(flipped.contains("along y (down) and z (away from the camera)"), "{flipped}");
        assert!(!flipped.contains("mirrored") && found([-0.9, 0.8, 0.9]).contains("mirrored"));
        let other = found([0.9, 0.8, 0.1]);
        assert!(other.contains("90 % of the person's pixels contradict"), "{other}");
    }

    #[test]
    fn pictures_without_normals_are_named() {
        let mut report = ReconstructReport::default();
        (report.surface.pixels.person, report.surface.pixels.no_normal) = (10, 10);
        let [one] = &warnings(&report)[..] else { panic!("one warning") };
        assert!(one.contains("no pixel of the person has a normal"), "{one}");
        report.surface.pixels.no_normal = 9;
        assert!(warnings(&report).is_empty());
    }
}
