"""Rasterizers: scenes, stages, pipelines. They make the picture and one launch for each kernel."""
