//! Values of arguments: lengths with units, points, labels, parameters.

use if_core::math::Point;
use if_pipeline::capture::PoseSigma;
use if_pipeline::capture::synth::ShapeNoise;

/// A positive, finite factor.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive number, such as 0.001".into()),
    }
}

/// A length in metres from text with a unit.
pub(crate) fn length(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let unit_at =
        text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    // Divided, not multiplied: 0.5 / 1000 is the nearest number to 0.0005, 0.5 · 0.001 need not be.
    let per_metre = match unit {
        "" | "m" => 1.0,
        "cm" => 100.0,
        "mm" => 1000.0,
        "um" => 1e6,
        _ => return Err(format!("unit `{unit}` is unknown; use m, cm, mm or um")),
    };
    match number.trim().parse::<f64>() {
        Ok(value) if value < 0.0 => Err("a length cannot be negative".into()),
        Ok(value) if value.is_finite() => Ok(value / per_metre),
        _ => Err(format!("`{}` is not a number; give a length such as 0.5mm", number.trim())),
    }
}

/// A length above zero.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    length(text).and_then(|value| {
        if value > 0.0 { Ok(value) } else { Err("a length above zero is needed".into()) }
    })
}

/// N numbers with commas between them, and nothing else.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    numbers?.try_into().ok()
}

/// An error of poses: degrees and millimetres, with a comma between them.
pub(crate) fn pose_sigma(text: &str) -> Result<PoseSigma, String> {
    let Some([degrees, mm]) = numbers(text) else {
        return Err("give DEGREES,MILLIMETRES, such as 3,9".into());
    };
    let sigma = PoseSigma { degrees, translation: mm / 1000.0 };
    sigma.validate().map(|()| sigma).map_err(|e| e.to_string())
}

/// `3,20`: percent of the length of bones, and millimetres of circumference.
pub(crate) fn shape_noise(text: &str) -> Result<ShapeNoise, String> {
    let Some([percent, mm]) = numbers(text) else {
        return Err("give PERCENT,MILLIMETRES, such as 3,20".into());
    };
    let noise = ShapeNoise { bones: percent / 100.0, girth: mm / 1000.0 };
    noise.validate().map(|()| noise).map_err(|e| e.to_string())
}

/// Three coordinates in metres, with commas between them.
pub(crate) fn point(text: &str) -> Result<Point, String> {
    match numbers(text) {
        Some([x, y, z]) if [x, y, z].iter().all(|x| x.is_finite()) => Ok(Point::new(x, y, z)),
        _ => Err("give three numbers, such as 0.1,1.2,-0.05".into()),
    }
}

/// `2=trousers`.
pub(crate) fn label_name(text: &str) -> Result<(u8, String), String> {
    let (label, name) = text.split_once('=').ok_or("give LABEL=NAME, such as 2=trousers")?;
    match label.trim().parse::<u8>() {
        Ok(label @ 1..=254) => Ok((label, name.trim().to_owned())),
        _ => Err("a label is a whole number from 1 to 254".into()),
    }
}

/// `key=value` with a TOML value, or a word without quotes; dots in the key step into groups.
pub(crate) fn assignment(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text.split_once('=').ok_or("give KEY=VALUE, such as clearance=0.0005")?;
    let (key, value) = (key.trim().to_owned(), value.trim());
    let parsed =
        format!("v = {value}").parse::<toml::Table>().map(|table| table.into_iter().next());
    match parsed {
        Ok(Some((_, value))) => Ok((key, value)),
        Ok(None) => Err("the value is empty".into()),
        Err(_)
            if value.starts_with(|c: char| c.is_ascii_alphabetic())
                && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') =>
        {
            Ok((key, value.into()))
        }
        Err(e) => Err(format!(
            "the value is not TOML ({}); text with other characters than letters needs quotes inside the shell's quotes",
            e.message()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_are_toml_or_words() {
        assert_eq!(assignment("split=if_left").unwrap(), ("split".into(), "if_left".into()));
        assert_eq!(assignment(" a.b = \"two words\"").unwrap(), ("a.b".into(), "two words".into()));
        assert_eq!(assignment("rounds=3"), Ok(("rounds".into(), toml::Value::Integer(3))));
        assert_eq!(assignment("a.b = true"), Ok(("a.b".into(), toml::Value::Boolean(true))));
        assert_eq!(assignment("skip=false").unwrap().1, toml::Value::Boolean(false));
        assert_eq!(assignment("clearance=5e-4").unwrap().1, toml::Value::Float(5e-4));
        for text in ["rounds", "rounds=", "split=two words", "split=-x", "split=3d"] {
            assert!(assignment(text).is_err(), "{text}");
        }
    }

    #[test]
    fn lists_of_numbers_hold_nothing_else() {
        assert_eq!(pose_sigma("3, 9").map(|s| (s.degrees, s.translation)), Ok((3.0, 0.009)));
        for text in ["", "3", "3,9,1", "3,junk,9", "3,,9", "3,9,", "-1,9"] {
            assert!(pose_sigma(text).is_err() && shape_noise(text).is_err(), "{text}");
        }
        assert!(point("0.1,1.2,-0.05").is_ok() && point("0.1,x,1.2,-0.05").is_err());
    }

    #[test]
    fn lengths_have_units() {
        for text in ["0.5mm", "0.0005", "0.0005m", "0.05 cm", "5e-4", "5e-4m", "500um"] {
            assert_eq!(length(text), Ok(0.0005), "{text}");
        }
        for text in ["", "mm", "0.5ft", "nan", "inf", "1 2mm", "0.5 mm mm", "-1mm"] {
            assert!(length(text).is_err(), "{text}");
        }
    }

    #[test]
    fn points_have_three_coordinates() {
        assert_eq!(point("0.1, -2,3e-1"), Ok(Point::new(0.1, -2.0, 0.3)));
        for text in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan"] {
            assert!(point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn labels_have_names() {
        assert_eq!(label_name("2 = trousers"), Ok((2, "trousers".into())));
        for text in ["trousers", "0=skin", "255=x", "two=x"] {
            assert!(label_name(text).is_err(), "{text}");
        }
    }
}
