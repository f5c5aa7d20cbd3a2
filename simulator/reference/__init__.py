"""The exact rasterizer that pictures of the pipelines are judged by: it models no GPU."""
