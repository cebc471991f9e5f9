//! Parameters of work on meshes, written as JSON and read again.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use if_mesh::baked::{BakeParams, Redistance};
use if_mesh::extract::ExtractParams;
use if_mesh::labels::{CutParams, SmoothLabelParams, VoteParams};
use serde::{Serialize, de::DeserializeOwned};

/// Written and read again it is the same; what is left out is the default; what nobody knows is
/// refused.
fn is_the_same_again<P: Serialize + DeserializeOwned + Default + PartialEq + std::fmt::Debug>(
    changed: P,
) {
    for params in [P::default(), changed] {
        let text = serde_json::to_string(&params).expect("text");
        assert_eq!(serde_json::from_str::<P>(&text).expect("its own text"), params, "{text}");
    }
    assert_eq!(serde_json::from_str::<P>("{}").expect("all defaults"), P::default());
    let fault =
        serde_json::from_str::<P>(r#"{"celll": 0.01}"#).expect_err("no such field").to_string();
    assert!(fault.contains("unknown field `celll`"), "{fault}");
}

#[test]
fn parameters_are_the_same_after_writing_and_reading() {
    let region = Some(Aabb { min: Point::origin(), max: Point::new(1.0, 2.0, 3.0) });
    is_the_same_again(BakeParams {
        accuracy: Real::INFINITY,
        depth: 0.1,
        redistance: Redistance::Never,
        region,
        ..Default::default()
    });
    let mut votes = VoteParams { margin: 3, ..Default::default() };
    votes.raster.cull_back = true;
    is_the_same_again(votes);
    is_the_same_again(CutParams { least: 0.1 });
    is_the_same_again(SmoothLabelParams { length: 0.01, ..Default::default() });
    is_the_same_again(ExtractParams { relax: 3, ..Default::default() });
}

#[test]
fn an_infinite_depth_is_a_word_and_other_words_are_refused() {
    let text = serde_json::to_string(&BakeParams::default()).unwrap();
    assert!(
        text.contains(r#""depth":"infinite""#) && text.contains(r#""redistance":"when_needed""#),
        "{text}"
    );
    for bad in [r#"{"depth": "deep"}"#, r#"{"depth": null}"#, r#"{"cell": "infinite"}"#] {
        assert!(serde_json::from_str::<BakeParams>(bad).is_err(), "{bad}");
    }
}
