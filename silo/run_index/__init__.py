"""Which runs there are: an index of folders of logs, kept beside them, and what people say of them."""
