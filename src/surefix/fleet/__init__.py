"""Many logs, or many tracks of one data set: over processes here, or on Apache Spark.

All of them call `surefix.pipelines.clean` for each log; nothing here estimates anything.
"""
