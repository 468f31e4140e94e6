//! What happens in a test: name, severity, sentence.
