//! Parameters by name, as outfit files, command lines and Python give them.

use crate::params::ResolveParams;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A named parameter cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NamedParameterError {
    /// There is no such parameter.
    #[error("unknown parameter `{name}`; valid names are {valid}")]
    Unknown {
        /// The name given.
        name: String,
        /// All names with their groups.
        valid: String,
    },
    /// The value is of another type than the parameter.
    #[error("parameter `{name}`: {message}")]
    Value {
        /// The name given.
        name: String,
        /// What is wrong.
        message: String,
    },
}

impl ResolveParams {
    /// The parameters with one of them replaced. Ranges are not checked: see
    /// [`ResolveParams::validate`].
    ///
    /// `name` is a name with its group (`goal.clearance`), a name alone (`clearance`), or a group,
    /// with a map of its parameters as the value.
    ///
    /// # Errors
    ///
    /// There is no such parameter, or the value is of another type.
    ///
    /// # Examples
    ///
    /// ```
    /// # use if_outfit::ResolveParams;
    /// let params = ResolveParams::default().with("clearance", &0.001)?;
    /// assert_eq!(params.goal.clearance, 0.001);
    /// # Ok::<(), if_outfit::NamedParameterError>(())
    /// ```
    pub fn with(&self, name: &str, value: &impl Serialize) -> Result<Self, NamedParameterError> {
        with_parameter(self, name, value)
    }
}

/// Parameters of any kind with one of them replaced: those that are maps of numbers, of texts and of
/// groups when they are serialised, such as [`ResolveParams`]. Ranges are not checked.
///
/// # Errors
///
/// As [`ResolveParams::with`].
pub fn with_parameter<T: Clone + Serialize + DeserializeOwned>(
    params: &T,
    name: &str,
    value: &impl Serialize,
) -> Result<T, NamedParameterError> {
    let invalid = |message| NamedParameterError::Value { name: name.to_owned(), message };
    let value = serde_json::to_value(value).map_err(|e| invalid(e.to_string()))?;
    if value.is_null() {
        // As JSON has NaN and infinity.
        return Err(invalid("there is no value, or it is not a finite number".to_owned()));
    }
    let mut all = serde_json::to_value(params).map_err(|e| invalid(e.to_string()))?;
    if let Some(group) = all.get(name).and_then(Value::as_object) {
        let Some(fields) = value.as_object() else {
            let fields: Vec<String> = group.keys().map(|field| format!("`{field}`")).collect();
            let fields = fields.join(", ");
            return Err(invalid(format!(
                "it is a group; give a mapping of its parameters {fields}"
            )));
        };
        let one = |params: T, (field, value): (&String, &Value)| {
            with_parameter(&params, &format!("{name}.{field}"), value)
        };
        return fields.iter().try_fold(params.clone(), one);
    }
    let paths = paths(&all);
    let is_meant = |path: &&String| match path.split_once('.') {
        Some((_, field)) => *path == name || field == name,
        None => *path == name,
    };
    let found: Vec<_> = paths.iter().filter(is_meant).collect();
    let [path] = found[..] else {
        let valid: Vec<String> = paths.iter().map(|path| format!("`{path}`")).collect();
        let (name, valid) = (name.to_owned(), valid.join(", "));
        return Err(NamedParameterError::Unknown { name, valid });
    };
    let place = path.split('.').fold(&mut all, |at, part| &mut at[part]);
    if let (true, Some(text)) = (place.is_number(), value.as_str()) {
        return Err(invalid(format!("`{text}` is text; give a number (lengths are in metres)")));
    }
    *place = value;
    serde_json::from_value(all).map_err(|e| invalid(e.to_string()))
}

/// The names of all parameters, those in groups with their group.
fn paths(params: &Value) -> Vec<String> {
    let all = params.as_object().into_iter().flatten();
    let paths = all.flat_map(|(name, value)| match value.as_object() {
        Some(fields) => fields.keys().map(|field| format!("{name}.{field}")).collect(),
        None => vec![name.clone()],
    });
    paths.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_parameter_is_replaced_by_its_name_with_or_without_its_group() {
        let params = ResolveParams::default();
        let changed = params.with("clearance", &0.002).unwrap();
        assert_eq!(changed.goal.clearance, 0.002);
        assert_eq!(params.with("goal.clearance", &0.002).unwrap(), changed);
        assert_eq!(params.with("goal", &json!({"clearance": 0.002})).unwrap(), changed);
        assert_eq!(params.with("sweeps", &3).unwrap().effort.sweeps, 3);
        let error = params.with("clearance", &true).unwrap_err();
        assert!(matches!(error, NamedParameterError::Value { .. }), "{error}");
        let error = params.with("clearance", &"1mm").unwrap_err().to_string();
        let says = "parameter `clearance`: `1mm` is text; give a number (lengths are in metres)";
        assert_eq!(error, says);
        let error = params.with("split", &5).unwrap_err().to_string();
        assert!(error.starts_with("parameter `split`: invalid type"), "{error}");
    }

    #[test]
    fn unknown_parameters_are_errors_that_list_the_valid_names() {
        for name in ["clearence", "cloth.clearance", "goal.clearance.more", ""] {
            let message = ResolveParams::default().with(name, &0.002).unwrap_err().to_string();
            let start = format!("unknown parameter `{name}`; valid names are ");
            assert!(message.starts_with(&start), "{message}");
            assert!(
                message.contains("`goal.clearance`, ") && message.contains("`cloth.strain_limit`")
            );
        }
    }

    #[test]
    fn a_group_takes_a_mapping() {
        let error = ResolveParams::default().with("goal", &3).unwrap_err().to_string();
        let start =
            "parameter `goal`: it is a group; give a mapping of its parameters `clearance`, ";
        assert!(error.starts_with(start), "{error}");
    }

    #[test]
    fn parameters_beside_groups_are_replaced_by_name() {
        let params = json!({"turn": 0.1, "walk": {"gap": 0.001, "sweeps": 4}});
        let with = |name: &str, value| with_parameter(&params, name, &value);
        let wanted = json!({"turn": 0.2, "walk": {"gap": 0.001, "sweeps": 4}});
        assert_eq!(with("turn", json!(0.2)).unwrap(), wanted);
        let wanted = json!({"turn": 0.1, "walk": {"gap": 0.002, "sweeps": 4}});
        for (name, value) in [("gap", json!(0.002)), ("walk.gap", json!(0.002))] {
            assert_eq!(with(name, value).unwrap(), wanted);
        }
        assert_eq!(with("walk", json!({"gap": 0.002})).unwrap(), wanted);
        let error = with("walk.turn", json!(1)).unwrap_err().to_string();
        let says =
            "unknown parameter `walk.turn`; valid names are `turn`, `walk.gap`, `walk.sweeps`";
        assert_eq!(error, says);
    }
}
