//! From pictures to an outfit: a capture is made, reconstructed, and what was found is worn.

use crate::folder::Folder;
use if_core::field::SignedDistance;
use if_mesh::ply;
use if_neural::field::NeuralField;
use if_neural::files::{read_deformation, read_network};
use serde_json::Value;

#[test]
fn a_capture_becomes_garments_that_are_worn() {
    let folder = Folder::new();
    folder.ifg("capture synth --out cap --garments trousers,tshirt --frames 6 --size 96").expect(0);
    let run = folder.ifg("reconstruct cap --body cap/body --out w --cell 24mm --bake --phi-steps 2 --frames --motion-steps 3 --strict").expect(0);
    // All frames match their images.
    assert!(!run.stdout.contains("warning"), "{}", run.stdout);
    for word in [
        "6 of 6 frames",
        "6 frames move on their own",
        "motion as a network",
        "φ as a network",
        "trousers",
        "tshirt",
    ] {
        assert!(run.stdout.contains(word), "{word}\n{}", run.stdout);
    }
    let info: Value =
        serde_json::from_slice(&folder.read("w/garments/cap_tshirt/asset.json")).unwrap();
    assert_eq!(info["phi"]["network"]["file"], "phi.safetensors");
    assert_eq!(info["phi"]["baked"]["file"], "phi.baked");
    // φ is that of the clothed person: the garment lies on its surface.
    let (network, frame) =
        read_network(&folder.read("w/garments/cap_tshirt/phi.safetensors")[..]).unwrap();
    let field = NeuralField::new(network, frame).unwrap();
    let garment = ply::read_path(&folder.path("w/garments/cap_tshirt/garment.ply")).unwrap().mesh;
    let off = garment.vertices().iter().map(|p| field.distance(p).abs()).sum::<f64>()
        / garment.vertices().len() as f64;
    assert!(off < 0.004, "{off}");
    // The report says how far frames move, and without motion they are other ones.
    let report: Value = serde_json::from_slice(&folder.read("w/clothed/cap/report.json")).unwrap();
    assert_eq!(report["motion"]["frames"].as_array().unwrap().len(), 6);
    let (network, _) =
        read_deformation(&folder.read("w/clothed/cap/deformation.safetensors")[..]).unwrap();
    assert_eq!(network.config().frames, 6);
    // The report is one page with its pictures inside.
    let page = String::from_utf8(folder.read("w/clothed/cap/report.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("src=\"http"));
    let body = info["body"]["name"].as_str().unwrap();
    let worn = folder
        .ifg(&format!("wardrobe match w --body {body} cap_trousers cap_tshirt --out worn"))
        .expect(0);
    let clean = ["-> 0 intersecting pairs", "-> 0 vertices inside"]
        .iter()
        .all(|words| worn.stdout.contains(words));
    assert!(clean, "{}", worn.stdout);
    // The outfit moves as the person of the capture does.
    let moves = format!(
        "animate --body w/bodies/{body}/body.ply worn/cap_trousers.ply worn/cap_tshirt.ply \
         --motion cap/meta.json --frames 0-1 --no-pictures --out moves"
    );
    let run = folder.ifg(&moves).expect(0);
    assert!(run.stdout.contains("2 frames: 2 clean"), "{}", run.stdout);
    // φ is made only on request, and the asset says so.
    folder
        .ifg("reconstruct cap --body cap/body --out bare --cell 24mm --frames --motion none")
        .expect(0);
    let frame = "clothed/cap/frames/frame_0004.ply";
    let (moved, plain) =
        (folder.read(&format!("w/{frame}")), folder.read(&format!("bare/{frame}")));
    assert!(moved.len() == plain.len() && moved != plain);
    folder.ifg("reconstruct cap --body cap/body --out never --motion none").expect(2);
    let info: Value =
        serde_json::from_slice(&folder.read("bare/garments/cap_tshirt/asset.json")).unwrap();
    assert_eq!(info["phi"], serde_json::json!({"network": null, "baked": null}));
}
