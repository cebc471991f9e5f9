//! Parameters by name, as outfit files, command lines and Python give them.

use crate::params::ResolveParams;
use serde::Serialize;
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
        let invalid = |e: serde_json::Error| NamedParameterError::Value {
            name: name.to_owned(),
            message: e.to_string(),
        };
        let value = serde_json::to_value(value).map_err(invalid)?;
        let mut groups = serde_json::to_value(self).map_err(invalid)?;
        if let (Some(_), Some(fields)) = (groups.get(name), value.as_object()) {
            let one = |params: Self, (field, value): (&String, &Value)| {
                params.with(&format!("{name}.{field}"), value)
            };
            return fields.iter().try_fold(self.clone(), one);
        }
        let names = names(&groups);
        let is_meant = |(group, field): &&(String, String)| match name.split_once('.') {
            Some(both) => both == (group, field),
            None => name == field,
        };
        let found: Vec<_> = names.iter().filter(is_meant).collect();
        let [(group, field)] = found[..] else {
            let valid: Vec<String> = names.iter().map(|(g, f)| format!("`{g}.{f}`")).collect();
            let (name, valid) = (name.to_owned(), valid.join(", "));
            return Err(NamedParameterError::Unknown { name, valid });
        };
        if let (true, Some(text)) = (groups[group][field].is_number(), value.as_str()) {
            let message = format!("`{text}` is text; give a number (lengths are in metres)");
            return Err(NamedParameterError::Value { name: name.to_owned(), message });
        }
        groups[group][field] = value;
        serde_json::from_value(groups).map_err(invalid)
    }
}

/// The names of all parameters: group and field.
fn names(groups: &Value) -> Vec<(String, String)> {
    let groups = groups.as_object().into_iter().flatten();
    let fields = groups.flat_map(|(group, fields)| {
        fields.as_object().into_iter().flatten().map(|(field, _)| (group.clone(), field.clone()))
    });
    fields.collect()
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
        for name in ["clearence", "cloth.clearance", "goal.clearance.more", "goal", ""] {
            let message = ResolveParams::default().with(name, &0.002).unwrap_err().to_string();
            let start = format!("unknown parameter `{name}`; valid names are ");
            assert!(message.starts_with(&start), "{message}");
            assert!(
                message.contains("`goal.clearance`, ") && message.contains("`cloth.strain_limit`")
            );
        }
    }
}
